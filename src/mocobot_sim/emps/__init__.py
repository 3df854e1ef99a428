"""The EMPS axis and its digital loop."""
