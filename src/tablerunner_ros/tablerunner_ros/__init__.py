"""What every Tablerunner node shares: parameters from dataclasses, messages to records, QoS, diagnostics."""
