"""Extended models of teams: folders that plain MuJoCo can load."""
