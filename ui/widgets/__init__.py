"""Parts that panels and dialogs are made of, their theme, and where they stand."""
