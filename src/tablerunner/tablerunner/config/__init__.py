"""Configuration as frozen dataclasses: each default, unit, bound and description stands once.

`parameter` declares a field, `Config` checks it, `build` makes a Config from a mapping, and
`Document` reads YAML so that an error names file, line, field and value.
"""

from tablerunner.config.build import build, load, to_mapping
from tablerunner.config.document import Document
from tablerunner.config.parameter import Config, Parameter, parameter, parameters_of

__all__ = [
    'Config',
    'Document',
    'Parameter',
    'build',
    'load',
    'parameter',
    'parameters_of',
    'to_mapping',
]
