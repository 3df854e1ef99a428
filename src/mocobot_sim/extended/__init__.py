"""Extended models: folders that plain MuJoCo loads."""
