"""The strategy `impact`: what an edit changes is found by pairs of paths, and rendered where it is seen."""
