"""What ROS prints of a pair of cameras: camera_info messages and camera_calibration's oST text."""


def message(size, K, D, R, P, model="plumb_bob", frame="left", seconds=1, old=False, block=False):
    """As ROS 2 prints them, or ROS 1 (``old``); ``block``: a number a line."""
    names = ("D", "K", "R", "P") if old else ("d", "k", "r", "p")
    lines = ["header: ", f"  stamp: \n    sec: {seconds}\n    nanosec: 0", f'  frame_id: "{frame}"']
    lines += [f"height: {size[1]}", f"width: {size[0]}", f'distortion_model: "{model}"']
    for name, values in zip(names, (D, K, R, P)):
        lines += [f"{name}:", *(f"- {value}" for value in values)] if block else [f"{name}: {list(values)}"]
    lines += ["binning_x: 0", "binning_y: 0", "roi: ", "  x_offset: 0", "  y_offset: 0", "  height: 0", "  width: 0"]
    return "\n".join([*lines, "  do_rectify: False", "---"]) + "\n"


def ost(size, K, D, R, P, name="narrow_stereo/left", title="# oST version 5.0 parameters\n\n\n"):
    def rows(values, cols):
        lines = [values[start : start + cols] for start in range(0, len(values), cols)]
        return "".join(" ".join(f"{value:8f}" for value in line) + "\n" for line in lines)

    return (
        f"{title}[image]\n\nwidth\n{size[0]}\n\nheight\n{size[1]}\n\n[{name}]\n\ncamera matrix\n{rows(K, 3)}\n"
        f"distortion\n{rows(D, len(D))}\nrectification\n{rows(R, 3)}\nprojection\n{rows(P, 4)}\n"
    )
