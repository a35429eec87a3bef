from swarmwire.metrics.record.run_log import RunLog


class Noon:
    def utc_stamp(self):
        return "20261121T120000Z"


def test_each_text_is_in_the_file_at_once_with_its_time(tmp_path):
    log = RunLog(tmp_path, Noon())
    log.say("begins")
    log.say("observer X failed:\nTraceback\nOSError\n")
    assert (tmp_path / "log.txt").read_text().splitlines() == [
        "20261121T120000Z begins",
        "20261121T120000Z observer X failed:",
        "    Traceback",
        "    OSError",
    ]
    log.close()
    log.close()


def test_a_log_that_cannot_be_written_counts_its_lines_and_disturbs_nobody(tmp_path):
    (tmp_path / "log.txt").symlink_to("/dev/full")
    log = RunLog(tmp_path, Noon())
    log.say("one")
    log.say("two")
    assert log.lost == 2
    log.close()
