"""Laws in words, numbers and units, as people and the simulator take them."""
