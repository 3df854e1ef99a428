"""Files of a bag: MCAP and SQLite, compressed or not, hostile or not."""
