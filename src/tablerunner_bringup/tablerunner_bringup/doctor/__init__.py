"""`tablerunner doctor`: gathers facts of the machine and of the running robot for the core."""
