# SPDX-License-Identifier: GPL-3.0-or-later
"""What scenes/generate.py is made of; Python's standard library only."""
