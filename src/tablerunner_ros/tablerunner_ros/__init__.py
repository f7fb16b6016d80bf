"""What every Tablerunner node shares: parameters, messages to records, QoS, diagnostics."""
