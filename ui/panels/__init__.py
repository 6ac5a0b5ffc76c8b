"""The panels: functions that draw values and return what the user made of them."""
