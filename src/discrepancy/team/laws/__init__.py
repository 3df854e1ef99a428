"""Laws at the places of a team of Omnids."""
