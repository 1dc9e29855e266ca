"""Rows of tables: each case is measured in a process of its own, and kept in a file, so that a long run can be resumed.

Cases enter; rows, CSV files and pages of Markdown leave. A crash, a timeout or a lack of memory is a row, too.
"""
