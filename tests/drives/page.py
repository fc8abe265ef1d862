"""Writes what was measured into a page, between two marker comments."""
import statistics

BEGIN, END = "<!-- drives: begin -->", "<!-- drives: end -->"


def median_and_worst(values, decimals):
    """ "median / worst", or what stands for no figure."""
    known = [value for value in values if value is not None]
    if not known:
        return "-"
    return f"{statistics.median(known):.{decimals}f} / {max(known):.{decimals}f}"


def nested(row, *keys):
    for key in keys:
        row = row.get(key) if row is not None else None
    return row


def health_sums(rows):
    """Sums over rows: poses with a truth, wrong ones, those called good, right ones, those called lost."""
    known = [row["health"] for row in rows if row.get("health")]
    poses, wrong = (sum(health[key] for health in known) for key in ("poses", "wrong"))
    return {"poses": poses, "wrong": wrong, "right": poses - wrong,
            "wrong_called_good": sum(len(health["wrong_called_good"]) for health in known),
            "right_called_bad": sum(len(health["right_called_bad"]) for health in known)}


def groups_of(results):
    """Rows of all results by (group, labels, mutation, weighting), in the order of their first."""
    groups = {}
    for result in results:
        for row in result["rows"]:
            key = (result["group"], result["labels"], result["mutation"], row["weighting"])
            groups.setdefault(key, []).append(row)
    return groups


LABELS = {"files": "true", "model": "network", "none": "none", "random30": "30 % at random",
          "no_movers": "all movers are buildings", "buildings_move": "all buildings are cars",
          "vegetation_moves": "all vegetation is trucks"}


def odometry_row(key, rows):
    group, labels, _, weighting = key
    health = health_sums(rows)

    def figures(decimals, factor, *keys):
        values = [nested(row, "trajectory", *keys) for row in rows]
        return median_and_worst([None if v is None else factor * v for v in values], decimals)

    judged = any(row.get("health") for row in rows)
    ours = all("lost" in row for row in rows)
    voxels = [row["voxels"] for row in rows if row.get("voxels")]
    return [f"{group}: {len(rows)} of {rows[0]['scans']} scans", LABELS.get(labels, labels), weighting,
            figures(3, 1, "kitti", "translation_percent"), figures(3, 1, "ate_rmse_m"),
            figures(2, 100, "relative", "mean_translation_m"),
            f"{health['wrong_called_good']} of {health['wrong']}" if judged else "-",
            f"{health['right_called_bad']} of {health['right']}" if judged else "-",
            f"{sum(row['lost'] for row in rows)}, {sum(row['degenerate'] for row in rows)}" if ours else "-",
            f"{statistics.median(voxels) / 1000:.1f}" if voxels else "-",
            f"{statistics.median(row['median_ms'] for row in rows):.1f} / "
            f"{max(row['p99_ms'] for row in rows):.1f}"]


def health_row(name, labels, mutation, rows):
    health = health_sums(rows)
    per_10000 = 1e4 * health["wrong_called_good"] / max(1, health["poses"])
    per_200 = 200 * health["right_called_bad"] / max(1, health["right"])
    return [mutation, name, LABELS.get(labels, labels), str(health["poses"]), str(health["wrong"]),
            f"{health['wrong_called_good']} ({per_10000:.1f})",
            f"{health['right_called_bad']} ({per_200:.2f})", str(sum(row["rejected"] for row in rows))]


def table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def odometry_table(results):
    head = ["drives", "labels", "weighting", "t_err %", "ATE m", "cm a scan", "wrong poses called good",
            "right ones called lost", "lost, degenerate", "thousand voxels", "ms a scan"]
    groups = groups_of(results)
    # Rows of the same drives stand together, those of other programs last.
    order = list(dict.fromkeys(key[0] for key in groups))
    keys = sorted((key for key in groups if key[2] == "none"), key=lambda key: order.index(key[0]))
    return table(head, [odometry_row(key, groups[key]) for key in keys])


def health_table(results):
    head = ["mutation", "drives", "labels", "poses", "wrong", "of these called good (in 10,000 poses)",
            "right, called lost (in 200 right ones)", "rejected scans"]
    groups, rows, everything = groups_of(results), [], {}
    for (group, labels, mutation, weighting), of_group in groups.items():
        if weighting == "semantic" and health_sums(of_group)["poses"]:
            everything.setdefault(mutation, []).extend(of_group)
            if mutation != "none":
                rows.append(health_row(group, labels, mutation, of_group))
    if "none" in everything:
        rows.insert(0, health_row("all drives", "all", "none", everything["none"]))
    rows.append(health_row("all drives", "all", "all of these", sum(everything.values(), [])))
    return table(head, rows)


def section(results, machine):
    """What stands between the markers."""
    if not results:
        return "Not run yet: `make drives`."
    commits = ", ".join(sorted({result["commit"] for result in results}))
    dates = sorted({result["date"] for result in results})
    when = dates[0] if len(dates) == 1 else f"{dates[0]} to {dates[-1]}"
    loads = [result["load"] for result in results if "load" in result]
    load = f" · load average {statistics.median(loads):.1f}" if loads else ""
    return "\n".join([
        f"`make drives` · {machine}{load} · {when} · {commits}", "",
        "Figures with a stroke are medians and the worst of the drives; times are the median scan, and the p99 "
        "of the slowest drive.", "",
        odometry_table(results), "",
        "Health, weighting `semantic`:", "", health_table(results)])


def put_between_markers(text, content):
    """The page's text with new content. Raises ValueError where it has no markers."""
    begin, end = text.find(BEGIN), text.find(END)
    if begin < 0 or end < begin:
        raise ValueError(f"has no {BEGIN} ... {END}")
    return text[:begin + len(BEGIN)] + "\n" + content + "\n" + text[end:]
