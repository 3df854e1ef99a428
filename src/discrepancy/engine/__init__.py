"""The search for causes; knows no rig."""
