"""The Omnid team in MuJoCo: scene, control, trajectories, sensors, trials."""
