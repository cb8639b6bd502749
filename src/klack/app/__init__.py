"""Local browser application: cases, runs, results and sliders of one folder."""
