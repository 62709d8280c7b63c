"""Drive models, controllers and evidence behind the replication notebooks.

Import the module you need (``from drivelib import pmsm``); nothing heavy is imported here.
"""

__version__ = "0.1.0"
