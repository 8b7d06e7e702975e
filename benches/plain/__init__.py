"""What `gen-data` does, in plain Python: the measure of its speed, written the obvious way with the standard library.

Reads the same PDDL, templates and lexicon, and writes records of the same columns. States are frozen sets of atoms, an
atom is a tuple of its predicate's and its objects' numbers, so that sorting gives the order of texts.
"""
