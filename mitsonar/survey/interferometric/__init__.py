"""Plan, simulate and measure an interferometric sidescan."""
