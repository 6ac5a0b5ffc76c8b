# For those whose fingers type make; everything is in ./run.
.PHONY: demo test lint edit bench
demo test lint edit bench:
	./run $@
