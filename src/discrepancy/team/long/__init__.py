"""Long recordings: in parts, some of which are searched for causes and the others held against what is found."""
