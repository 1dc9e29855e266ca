"""Rows of tables: each case is measured in a separate process, and kept in a file, so that a long run can be resumed.

Input: cases. Output: rows, CSV files and pages of Markdown. A crash, a timeout or a lack of memory is a row, too.
"""
