"""What no table lists, as a formula: functions of one signal, and the law that they tell."""
