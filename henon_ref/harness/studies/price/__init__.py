"""The price list: what accuracy costs in time, for every solver, landing, effect and horizon."""
