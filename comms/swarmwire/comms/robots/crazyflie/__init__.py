"""What driver and gateway of the Crazyflie share: its sensors, the names and units of its log variables.

Facts are from Bitcraze's crazyflie-firmware (docs/functional-areas/crtp, src/modules) and crazyflie-lib-python (cflib);
no code of either is used here.
"""
