"""Laws at the joints of a serial robot."""
