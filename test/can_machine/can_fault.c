// SPDX-License-Identifier: GPL-2.0
/* For tests alone: makes a CAN network device do what its driver would do when the bus fails.
 * echo "can0 bus_off" > /sys/kernel/debug/can_fault; words: see below. */
#include <linux/can/dev.h>
#include <linux/can/error.h>
#include <linux/debugfs.h>
#include <linux/if_arp.h>
#include <linux/module.h>
#include <linux/netdevice.h>
#include <linux/rtnetlink.h>
#include <linux/uaccess.h>

static struct dentry *file;

static void enter(struct net_device *device, enum can_state state)
{
	struct can_frame *frame;
	struct sk_buff *skb = alloc_can_err_skb(device, &frame);

	can_change_state(device, skb ? frame : NULL, state, state);
	if (state == CAN_STATE_BUS_OFF)
		can_bus_off(device);
	if (skb)
		netif_rx(skb);
}

static void tell_timeout(struct net_device *device)
{
	struct can_frame *frame;
	struct sk_buff *skb = alloc_can_err_skb(device, &frame);

	if (!skb)
		return;
	frame->can_id |= CAN_ERR_TX_TIMEOUT;
	netif_rx(skb);
}

static int apply(struct net_device *device, const char *word)
{
	if (!strcmp(word, "bus_off"))
		enter(device, CAN_STATE_BUS_OFF);
	else if (!strcmp(word, "passive"))
		enter(device, CAN_STATE_ERROR_PASSIVE);
	else if (!strcmp(word, "warning"))
		enter(device, CAN_STATE_ERROR_WARNING);
	else if (!strcmp(word, "active"))
		enter(device, CAN_STATE_ERROR_ACTIVE);
	else if (!strcmp(word, "stop_queue"))
		netif_stop_queue(device);
	else if (!strcmp(word, "wake_queue"))
		netif_wake_queue(device);
	else if (!strcmp(word, "timeout"))
		tell_timeout(device);
	else
		return -EINVAL;
	return 0;
}

static ssize_t fault_write(struct file *f, const char __user *text, size_t size, loff_t *offset)
{
	char line[64] = "", name[IFNAMSIZ], word[32];
	struct net_device *device;
	int error = -ENODEV;

	if (size >= sizeof(line) || copy_from_user(line, text, size))
		return -EINVAL;
	if (sscanf(line, "%15s %31s", name, word) != 2)
		return -EINVAL;
	rtnl_lock();
	device = __dev_get_by_name(&init_net, name);
	if (device && device->type == ARPHRD_CAN) {
		local_bh_disable();
		error = apply(device, word);
		local_bh_enable();
	}
	rtnl_unlock();
	return error ? error : size;
}

static const struct file_operations operations = { .owner = THIS_MODULE, .write = fault_write };

static int __init begin(void)
{
	file = debugfs_create_file("can_fault", 0200, NULL, NULL, &operations);
	return PTR_ERR_OR_ZERO(file);
}

static void __exit end(void)
{
	debugfs_remove(file);
}

module_init(begin);
module_exit(end);
MODULE_LICENSE("GPL");
MODULE_DESCRIPTION("Provokes faults of CAN network devices, for tests");
