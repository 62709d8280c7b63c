"""The one set of options with which everything here is compiled.

numba's cache on disk knows a function by file, name and types and not by its options. The same function compiled with
other options by another module would serve both, whichever was first: a divisor that is checked for zero stops a loop
over 64 drives from using the vector units.
"""

OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}
