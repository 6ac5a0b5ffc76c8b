"""Pictures as values: from radiance to the display, and how far two pictures are apart."""
