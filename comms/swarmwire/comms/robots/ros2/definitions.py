"""Definitions of messages that rosbags does not have: irobot_create_msgs, alike on its branches humble and rolling."""

PACKAGE = "irobot_create_msgs/msg"
HAZARD = f"{PACKAGE}/HazardDetection"
HAZARDS = f"{PACKAGE}/HazardDetectionVector"
INTENSITY = f"{PACKAGE}/IrIntensity"
INTENSITIES = f"{PACKAGE}/IrIntensityVector"
DOCK_STATUS = f"{PACKAGE}/DockStatus"
STOP_STATUS = f"{PACKAGE}/StopStatus"
WHEEL_TICKS = f"{PACKAGE}/WheelTicks"
WHEEL_VELS = f"{PACKAGE}/WheelVels"
HEADER = "std_msgs/Header header\n"
DEFINITIONS = {
    HAZARD: HEADER + "uint8 type",
    HAZARDS: HEADER + "irobot_create_msgs/HazardDetection[] detections",
    INTENSITY: HEADER + "int16 value",
    INTENSITIES: HEADER + "irobot_create_msgs/IrIntensity[] readings",
    DOCK_STATUS: HEADER + "bool dock_visible\nbool is_docked",
    STOP_STATUS: HEADER + "bool is_stopped",
    WHEEL_TICKS: HEADER + "int32 ticks_left\nint32 ticks_right",
    WHEEL_VELS: HEADER + "float32 velocity_left\nfloat32 velocity_right",
}
