"""Edit sessions without a window, with the error after each edit."""
