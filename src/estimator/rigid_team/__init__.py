"""Robots on one rigid body: closed loops of poses, and the balance of wrenches."""
