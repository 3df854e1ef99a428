"""Any fixed-base tree of hinges and slides that MuJoCo can read, and logs of its joints."""
