"""A study as one self-contained web page: no network, no server, no graphics card."""

from __future__ import annotations

from mitsuba_taxel.report.page.study_page import write_report

__all__ = ["write_report"]
