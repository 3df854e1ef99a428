"""Laws of friction, hysteresis and sensors as the literature has them, one step at a time; no simulator here."""
