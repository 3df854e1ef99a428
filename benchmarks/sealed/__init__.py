"""The sealed campaign: effects in other forms than the catalogue's laws, robots as they are, seeds never used."""
