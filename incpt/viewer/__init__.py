"""Rendering for somebody who looks: what to render next, and what there is to show."""
