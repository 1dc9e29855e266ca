"""Scenes that ship with the package; `taxel render NAME.xml` finds them by name anywhere."""
