"""The tables of README.md, of the model cards and of other pages, from the records they are backed by.

A table stands between ``<!-- table: NAME -->`` and ``<!-- end of table -->``. `pages` knows which function writes it.
"""
