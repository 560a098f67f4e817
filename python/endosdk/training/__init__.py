"""Networks, their training and their export: the only part of the package that needs torch."""
