# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pages: a campaign or recorded bags as one HTML file that needs nothing else.

:mod:`~imu_sim_ros.report.page` builds a page from its content;
:mod:`~imu_sim_ros.report.of_campaign` and :mod:`~imu_sim_ros.report.of_bag` make the content.
``assets/`` runs in the browser.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.report.of_bag import Estimate as Estimate
    from imu_sim_ros.report.of_bag import bag_sections as bag_sections
    from imu_sim_ros.report.of_campaign import campaign_sections as campaign_sections
    from imu_sim_ros.report.of_campaign import is_campaign as is_campaign
    from imu_sim_ros.report.page import Section as Section
    from imu_sim_ros.report.page import html as html
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "of_bag": ["Estimate", "bag_sections"],
            "of_campaign": ["campaign_sections", "is_campaign"],
            "page": ["Section", "html"],
        },
    )
