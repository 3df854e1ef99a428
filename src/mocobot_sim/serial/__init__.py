"""Serial robots with effects that the nominal model lacks."""
