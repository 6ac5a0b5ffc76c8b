# For those whose fingers type make; everything is in ./run.
.PHONY: demo test fast lint edit bench pictures screenshots
demo test fast lint edit bench:
	./run $@

# The pictures of the README.
pictures:
	./run render scenes/editing.toml -o scenes/pictures/editing.png --spp 512
	./run replay scenes/editing.toml scenes/pictures/rotate.edits.toml -o out/rotate --size 480x270 \
		--nor 256 --base-spp 512 --reference-spp 1024
	cp out/rotate/sheet.png scenes/pictures/rotate.png

# Those of the editor; they need Xvfb and xdotool.
screenshots:
	./run bench screenshots
