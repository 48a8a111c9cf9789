"""State out, commands in: shared memory between the processes of a running simulator."""
