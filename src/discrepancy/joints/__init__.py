"""Any robot of hinges and slides as a machine of the engine: signals, causes, columns."""
