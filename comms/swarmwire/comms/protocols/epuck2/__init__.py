"""GCtronic's e-puck2 over WiFi: its packets, and the meaning of their numbers.

The robot serves one TCP connection at a time, at port 1000. The client sends commands of 21 bytes; an answer is a
header of one byte and the announced content: an image, the sensors, or nothing. Firmware of 2018 and later repeats the
answer to the last command until the next command. Sources: epuck2_driver_cpp.cpp of GCtronic's epuck_driver_cpp (branch
e-puck2_wifi), the robot's firmware e-puck2_main-processor (Asercom2.c, motors.c, e_acc.c, e_lsm330.c, imu.c) and the
firmware of its radio module (socket_e-puck2.c, uart_e-puck2.c, rgb_led_e-puck2.c).
"""
