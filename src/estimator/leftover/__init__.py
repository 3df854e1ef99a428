"""What no rigid payload explains of a recording, beside what noise leaves."""
