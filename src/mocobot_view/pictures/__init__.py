"""Pictures of models, rendered by MuJoCo without a screen: teams, estimates and diagnoses."""
