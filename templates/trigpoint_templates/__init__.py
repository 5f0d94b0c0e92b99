"""Report templates, style sheets and fonts: data only, behind this one door."""
