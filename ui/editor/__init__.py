"""The editor's state: the document under edit, preferences, recovery, notices."""
