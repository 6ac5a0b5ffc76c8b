"""What the manual takes from the program itself: keys, options, formats, public names, as Markdown.

    PYTHONPATH=docs python -m reference            rewrite the pages of docs/
    PYTHONPATH=docs python -m reference --check    exit status 1 where they disagree with the program

A piece stands between two comments in a page, and is replaced there; `pages` names them all:

    <!-- from the program: options render -->
    <!-- end -->
"""
