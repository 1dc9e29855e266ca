"""A study as one web page that needs nothing else: no network, no server, no graphics card."""

from __future__ import annotations

from mitsuba_taxel.report.page.study_page import write_report

__all__ = ["write_report"]
