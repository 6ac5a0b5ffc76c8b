"""The command line: a module for each command, and `main`, which knows them all.

Modules import on top what they need to say which options there are, and nothing that loads numpy, pyopencl or
rich. Each command imports the rest when it runs, so that help and complaints about usage wait for no library.
"""
