"""One file per verb of the command line; each has ``configure(parser)`` and ``run(args)``."""
