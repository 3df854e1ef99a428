"""What the causes of every rig share."""
