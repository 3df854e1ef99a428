"""What every command can refuse before it loads numpy, MuJoCo or anything else that takes time: a module for each."""
