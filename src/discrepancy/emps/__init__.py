"""The EMPS rig: one electro-mechanical positioning axis, its drive and its position loop."""
