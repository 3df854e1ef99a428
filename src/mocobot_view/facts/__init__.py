"""What is known of a team: files and placements."""
