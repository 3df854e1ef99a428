"""Names of the causes of every rig: to know them takes nothing that their traces need."""
