"""Motion and measurement models with their Jacobians, as plain functions."""
