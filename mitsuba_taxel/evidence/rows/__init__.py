"""Tables of test cases. Each case is measured in a separate process; its result, a row of the table, is stored in a
file, so that a long run can be resumed.

Input: cases. Output: rows, CSV files and pages of Markdown. A crash, a timeout or a lack of memory also gives a row.
"""
